"""Run the command `smadrive` as `python -m smadrive`."""

from smadrive.cli import main

main()
