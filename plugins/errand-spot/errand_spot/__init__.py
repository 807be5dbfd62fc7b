"""Boston Dynamics' API of Spot: a server of it in simulation, and missions with a real Spot."""

import os

# gRPC would start its threads in the forked process that renders the plant's pictures, which has closed their files
os.environ.setdefault("GRPC_ENABLE_FORK_SUPPORT", "0")
