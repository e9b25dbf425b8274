//! Files that appear whole or not at all, checksums, manifests, resume.
