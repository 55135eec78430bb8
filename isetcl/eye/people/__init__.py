"""What differs between people: scatter, media, pupils and populations."""
