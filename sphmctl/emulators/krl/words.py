"""KRL's words: which cannot be names, what a name looks like, which words are not emulated."""

from __future__ import annotations


def words(text: str) -> frozenset[str]:
    """The words of a text, as a set."""
    return frozenset(text.split())


MAX_NAME = 24
"""Characters of a name (SI, "Names in KRL"); system variables may be longer."""

BASIC_TYPES = ("INT", "REAL", "BOOL", "CHAR")

BARE_TYPES = frozenset(
    (*BASIC_TYPES, "AXIS", "E3AXIS", "E6AXIS", "FRAME", "POS", "E3POS", "E6POS", "LOAD", "INERTIA")
)
"""Types that need no DECL before them: DECL "may be omitted for the predefined data types" (SI,
"DECL"). A type of the user's own needs it, so that `MOVE P1` is no declaration by accident."""

RESERVED = words(
    """AND B_AND B_EXOR B_NOT B_OR BRAKE CASE CIRC CIRC_REL CONST CONTINUE C_DIS C_ORI C_PTP C_SPL
    C_VEL DECL DEF DEFAULT DEFDAT DEFFCT ELSE END ENDDAT ENDFCT ENDFOR ENDIF ENDLOOP ENDSWITCH
    ENDWHILE ENUM EXIT EXOR EXT EXTFCT FALSE FOR GLOBAL GOTO HALT IF IMPORT INTERRUPT LIN LIN_REL
    LOOP NOT ON_ERROR_PROCEED OR PTP PTP_REL PUBLIC PULSE REPEAT RESUME RETURN SCIRC SIGNAL SLIN
    SPLINE SPTP STRUC SWITCH THEN TO TRIGGER TRUE WAIT WHEN WHILE"""
)
"""Words that cannot be names. STEP, SEC, DELAY, DISTANCE, PRIO, IN, OUT, ON, OFF, DO, WITH and
UNTIL can (`DATE.SEC`), by the public grammar of liukegeek/KrlParser."""

NOT_EMULATED = {
    "ANIN": "read $ANIN[n] instead",
    "ANOUT": "assign $ANOUT[n] instead",
    "DIGIN": "read $IN[n] instead",
    "IMPORT": "declare the variable GLOBAL in its data list instead",
    "SPLINE": "write single SLIN or SPTP motions instead",
    "PTP_SPLINE": "write single SPTP motions instead",
    "ENDSPLINE": "write single SLIN or SPTP motions instead",
    "TIME_BLOCK": "write single SLIN or SPTP motions instead",
    "CONST_VEL": "write single SLIN motions instead",
    "SPL": "write single SLIN or SPTP motions instead",
    "SPTP_REL": "write PTP_REL instead",
    "SLIN_REL": "write LIN_REL instead",
    "SCIRC_REL": "write CIRC_REL instead",
    "CHANNEL": "data channels to the outside are missing",
    "CONFIRM": "acknowledge messages at the panel",
    "DEFTP": "write DEF or DEFFCT",
    "INTERN": "declare the name GLOBAL or leave it local",
}
"""Words that begin a statement of KSS which this package does not know, and what to do."""

NO_KRL = {
    "ELSEIF": "KRL has no ELSEIF; put an IF into the ELSE",
    "ELSIF": "KRL has no ELSIF; put an IF into the ELSE",
    "CALL": "KRL calls a routine by its name alone: write NAME()",
    "ENDREPEAT": "REPEAT is closed by UNTIL with a condition",
    "DO": "DO stands only in TRIGGER and INTERRUPT DECL",
    "THEN": "THEN stands on the line of its IF",
    "VAR": "KRL declares by DECL TYPE NAME",
    "BREAK": "KRL leaves a loop by EXIT",
    "PRINT": "KRL has no PRINT",
}
"""Words of other languages, and what KRL has in their place."""


def name_fault(name: str) -> str:
    """What is wrong with a name of the user's, as the end of a sentence; "" when nothing is."""
    if name in RESERVED or name in BASIC_TYPES:
        return f"{name} is a word of KRL and cannot be a name"
    if len(name) > MAX_NAME and not name.startswith("$"):
        return f"{name} has {len(name)} characters; a name has at most {MAX_NAME}"
    return ""
