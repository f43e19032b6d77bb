"""The language KRL: parser, tree and checker, by which the emulated controller runs real files.

Not responsible for running anything. The order: `source` -> `lines` (with `grammar.lark`) ->
`parse` -> `nodes`; `check` looks at whole programs, `project` at files and folders. Rules come
from KUKA's "Operating and Programming Instructions for System Integrators" (KSS 8.3, chapter "KRL
syntax"), "Expert Programming" (KSS 5.2) and the public KRL grammar of J. Schloessin.
"""
