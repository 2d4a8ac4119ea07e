"""What the tests of the project file share."""
