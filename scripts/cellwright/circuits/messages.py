"""What is said of simulations of a model: `say(code, **fields)`; the sentences: messages.toml."""

from cellwright.messages import sayer

say = sayer(__package__)
