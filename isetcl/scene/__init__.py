"""What is looked at: shapes, materials, textures, displays, procedural targets."""
