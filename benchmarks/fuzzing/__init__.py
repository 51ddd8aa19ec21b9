"""What the fuzzer is made of: seeds, mutations that keep checksums right, and the doors that its files go through."""
