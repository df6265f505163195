"""What people look at: columns in, matplotlib figure out; one module per figure."""
