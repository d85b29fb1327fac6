//! Laws of contacts.

use crate::geometry::Friction;

/// The law that relates impulse and velocity of a contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    /// Signorini's condition with Coulomb's law: with the static coefficient if the contact can stick, else
    /// with the kinetic one.
    Coulomb(Friction),
    /// Bilateral constraint: u = 0 for any impulse.
    Bilateral,
}
