//! External actions: strained cells, servos, rain, inlets and outlets.

mod drives;
mod element;
mod flows;
mod groups;
mod rain;
mod servo;
mod servo_of_force;
