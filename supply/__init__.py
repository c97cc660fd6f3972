"""What metaid stands on: pins, licences and known vulnerabilities of its dependencies: `make audit`."""
