"""`python -m paraflex` is the command line."""

from paraflex.cli.app import main

if __name__ == "__main__":
    main()
