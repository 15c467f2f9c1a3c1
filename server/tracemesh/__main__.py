"""python -m tracemesh: the same as the command `tracemesh`."""

from tracemesh.cli import main

if __name__ == "__main__":
    main()
