"""The command line of this checkout, for benchmarks that start it."""

from grebe.cli.main import main

if __name__ == "__main__":
    main()
