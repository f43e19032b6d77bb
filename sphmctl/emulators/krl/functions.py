"""The functions that KRL has built in: how many arguments each takes, and what it gives.

Not responsible for what they compute. Names: the built-in list of KnoP-01/krl-for-vim, meanings
SI, chapter "KRL syntax" and "CREAD/CWRITE".
"""

from __future__ import annotations

from dataclasses import dataclass

from sphmctl.emulators.krl.words import words


@dataclass(frozen=True)
class Function:
    """One function.

    Attributes:
        least, most: arguments.
        result: the name of a type; "SAME" for that of the argument, "" where nothing comes back,
            "ANY" where it depends on what the function is used for.
        writes: the arguments it fills, counted from 0.
    """

    least: int
    most: int
    result: str
    writes: tuple[int, ...] = ()


_MANY = 32
"""Arguments of the functions that take as many as one likes."""

FUNCTIONS = {
    "ABS": Function(1, 1, "SAME"),
    **{name: Function(1, 1, "REAL") for name in ("SIN", "COS", "TAN", "ACOS", "ASIN", "SQRT")},
    "ATAN2": Function(2, 2, "REAL"),
    "INV_POS": Function(1, 1, "SAME"),
    "FORWARD": Function(2, 2, "E6POS", (1,)),
    "INVERSE": Function(3, 3, "E6AXIS", (2,)),
    "VARSTATE": Function(1, 1, "VAR_STATE"),
    "STRADD": Function(2, 2, "INT", (0,)),
    "STRCLEAR": Function(1, 1, "BOOL", (0,)),
    "STRCOMP": Function(2, 3, "BOOL"),
    "STRCOPY": Function(2, 2, "BOOL", (0,)),
    "STRDECLLEN": Function(1, 1, "INT"),
    "STRFIND": Function(3, 4, "INT"),
    "STRLEN": Function(1, 1, "INT"),
    **{
        f"STRTO{name}": Function(2, 2, "BOOL", (1,))
        for name in words("BOOL INT REAL STRING FRAME POS E3POS E6POS AXIS E3AXIS E6AXIS")
    },
    "SREAD": Function(5, _MANY, "", tuple(range(1, _MANY))),
    "SWRITE": Function(4, _MANY, "", (0, 1, 2)),
    "CAST_TO": Function(3, _MANY, "", (0, 1)),
    "CAST_FROM": Function(3, _MANY, "", tuple(range(1, _MANY))),
    "CWRITE": Function(4, _MANY, "", (1,)),
    "ERR_CLEAR": Function(1, 1, ""),
    "ERR_RAISE": Function(1, 1, ""),
    "ROB_STOP": Function(1, 1, "BOOL"),
    "ROB_STOP_RELEASE": Function(0, 0, "BOOL"),
    "B_NOT": Function(1, 1, "INT"),
    **{
        name: Function(1, _MANY, "ANY")
        for name in words(
            "SVEL_JOINT SVEL_CP SACC_JOINT SACC_CP STOOL2 SBASE SLOAD SAPO SAPO_PTP SGEAR_JERK "
            "SIPO_MODE SORI_TYP USE_CM_PRO_VALUES COLLMON_TOL_PRO"
        )
    },
}

STOPS_ADVANCE = frozenset(("CWRITE",))
"""Functions at which the advance run waits (SI, "CREAD/CWRITE")."""
