"""`python -m metaid` is the command `metaid`."""

from metaid.cli import main

if __name__ == "__main__":
    main()
