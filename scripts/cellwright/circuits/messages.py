"""What is said of a model and its simulations: `say(code, **fields)`; sentences: messages.toml."""

from cellwright.messages import sayer

say = sayer(__package__)
