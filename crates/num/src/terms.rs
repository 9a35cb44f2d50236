//! Enumerations whose values have names and meanings: [`terms!`](crate::terms).

/// Defines an enumeration of terms from one table, so that its documentation, help, documents and other languages follow
/// from it.
///
/// ```
/// elbowroom_num::terms! {
///     /// A side.
///     #[derive(Clone, Copy, Debug, PartialEq)]
///     pub enum Side {
///         Left = "left": "the side of the heart",
///         Right = "right": "the other side",
///     }
/// }
///
/// assert_eq!(Side::Left.name(), "left");
/// assert_eq!(Side::TERMS[1], (Side::Right, "right", "the other side"));
/// ```
#[macro_export]
macro_rules! terms {
    (
        $(#[$outer:meta])*
        $vis:vis enum $Enum:ident {
            $($(#[$attribute:meta])* $Value:ident = $name:literal: $meaning:literal,)+
        }
    ) => {
        $(#[$outer])*
        $vis enum $Enum {
            $(#[doc = concat!("`", $name, "`: ", $meaning, ".")] $(#[$attribute])* $Value,)+
        }

        impl $Enum {
            /// All values, each with its name in documents and its meaning.
            pub const TERMS: &'static [(Self, &'static str, &'static str)] =
                &[$((Self::$Value, $name, $meaning)),+];

            /// Returns the name in documents.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$Value => $name,)+
                }
            }
        }
    };
}
