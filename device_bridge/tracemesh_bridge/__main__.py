"""python -m tracemesh_bridge: the same as tracemesh-bridge."""

import sys

from tracemesh_bridge.cli import main

sys.exit(main())
