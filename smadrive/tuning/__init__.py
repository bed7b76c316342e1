"""The live tuning page: a control loop, and beside it in a process of its own a page that looks and asks."""
