"""smadrive: the driver that makes a shape-memory-alloy wire move where it is told."""
