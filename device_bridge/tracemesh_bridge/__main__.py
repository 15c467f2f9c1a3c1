"""python -m tracemesh_bridge: the same as the command `tracemesh-bridge`."""

from tracemesh_bridge.cli import main

if __name__ == "__main__":
    main()
