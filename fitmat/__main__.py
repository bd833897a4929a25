"""`python -m fitmat`."""

from fitmat.cli import main

if __name__ == "__main__":
    main()
