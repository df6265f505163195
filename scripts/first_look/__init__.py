"""A first look at files: `./run cellwright inspect FILE`, `init FOLDER`, `convert FILE`."""
