"""`python -m fitmat`."""

from fitmat.cli.commands import main

if __name__ == "__main__":
    main()
