//! Plain strands and motion tracks made into `groom.json` and `anim.json`.
