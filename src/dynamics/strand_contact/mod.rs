//! Contact between guides, and of guides with themselves, within one sub-step (`docs/theory.md` §5.2).
//!
//! Every guide first takes the sub-step uncoupled, in contact with bodies only. Guides that would then come
//! too close to others or to themselves, or that were pushed in the sub-step before, are coupled with all
//! guides in contact with them: rounds of solving for the reactions, contacts with bodies included, moving the
//! guides, and detecting contacts again.

mod checkpoint;
mod contact_law;
mod contact_pair;
mod contact_pairs;
mod coupled_guide;
mod division;
mod given_motion;
mod island;
mod reactions;
mod strand_contacts;
#[cfg(test)]
mod tests;

pub(super) use contact_law::BundleProperties;
pub(super) use contact_pairs::RECOVERY_SPEED;
pub(super) use strand_contacts::StrandContacts;
