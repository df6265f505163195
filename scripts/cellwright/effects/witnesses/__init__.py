"""Independent measurements beside a verdict: which agree with it, contradict it, or are silent."""
