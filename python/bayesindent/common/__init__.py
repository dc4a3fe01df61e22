"""What every step uses: files of results, and progress."""
