"""What is best done with cells of packs, and how sure that is."""
