"""Observer of wire temperature and phase, and its gains."""
