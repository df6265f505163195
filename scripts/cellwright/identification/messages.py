"""What is said of models and their choice: `say(code, **fields)`; the sentences: messages.toml."""

from cellwright.messages import sayer

say = sayer(__package__)
