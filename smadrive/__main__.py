"""`python -m smadrive` is the command `smadrive`."""

from smadrive.cli import main

main()
