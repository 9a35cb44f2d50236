//! Ports by reference and in boxes.

/// Implements a port for mutable references and for boxes of its implementations. The methods with
/// `&mut self` come first, those with `&self` after `ref`.
macro_rules! forward_port {
    ($port:ident { $($mutable:tt)* } ref { $($shared:tt)* }) => {
        crate::forward::forward_port!(@to &mut P, $port { $($mutable)* } ref { $($shared)* });
        crate::forward::forward_port!(@to Box<P>, $port { $($mutable)* } ref { $($shared)* });
    };
    (@to $target:ty, $port:ident {
        $(fn $name:ident(&mut $this:ident $(, $argument:ident: $type:ty)*) $(-> $result:ty)?;)*
    } ref {
        $(fn $query:ident(&$own:ident) -> $answer:ty;)*
    }) => {
        impl<P: $port + ?Sized> $port for $target {
            $(fn $name(&mut $this $(, $argument: $type)*) $(-> $result)? {
                (**$this).$name($($argument),*)
            })*

            $(fn $query(&$own) -> $answer {
                (**$own).$query()
            })*
        }
    };
}

pub(crate) use forward_port;
