"""`python -m maniport` is the command line."""

from maniport.start import main

main()
