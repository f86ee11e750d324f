"""What MEMO promises about speed and quality, measured on this machine (``memo bench``)."""
