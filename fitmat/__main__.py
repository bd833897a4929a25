"""`python -m fitmat`."""

from fitmat.cli.main import main

if __name__ == "__main__":
    main()
