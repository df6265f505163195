"""What each test protocol tells: steps in, tables out."""
