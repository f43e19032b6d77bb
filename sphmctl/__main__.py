"""`python -m sphmctl` is the command `sphmctl`."""

from sphmctl.cli.main import main

main()
