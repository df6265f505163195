"""Words of the effects: `say(code)`; they stand in messages.toml."""

from cellwright.messages import sayer

say = sayer(__package__)
