//! What acts from outside: servos, rain, inlets and outlets.

mod drives;
mod flows;
mod groups;
mod rain;
mod servo;
mod servo_of_force;
