"""`python -m maniport` is the command line."""

from maniport.cli import main

main()
