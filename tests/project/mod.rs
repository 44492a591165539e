//! Checks of the project itself: guide, tables, layers, files for sites.

mod guide;
mod layers;
mod site;
mod tables;
