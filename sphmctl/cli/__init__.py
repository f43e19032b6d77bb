"""The command line: one file per command group; errors become exit codes; no logic."""
