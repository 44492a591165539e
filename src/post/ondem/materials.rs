//! Materials of the scene of a snapshot.

use crate::output::header::{Header, ShapeRow};

/// Materials of the scene of a snapshot.
pub(super) struct Materials {
    pub(super) all: Vec<toml::Table>,
    pub(super) of_shapes: Vec<usize>,
    pub(super) of_walls: Vec<usize>,
}

impl Materials {
    /// Without materials in the scene of a snapshot, each shape has one with its density.
    pub(super) fn of(header: &Header) -> Self {
        let scene: toml::Table = header.scene.parse().unwrap_or_default();
        let tables = |key: &str| {
            let list = scene.get(key).and_then(toml::Value::as_array).cloned().unwrap_or_default();
            list.into_iter().filter_map(|table| table.try_into().ok()).collect::<Vec<toml::Table>>()
        };
        let all = tables("material");
        if all.is_empty() {
            let of_shape = |shape: &ShapeRow| {
                let density = toml::Value::Float(shape.mass / shape.volume);
                let name = toml::Value::String(shape.name.clone());
                [("density".to_owned(), density), ("name".to_owned(), name)].into_iter().collect()
            };
            let all: Vec<toml::Table> = header.shapes.iter().map(of_shape).collect();
            let of_shapes = (0..all.len()).collect();
            return Self { all, of_shapes, of_walls: vec![0; header.walls.len()] };
        }
        let mut named = tables("shape");
        named.extend(tables("wall"));
        let side = scene.get("domain").and_then(|domain| domain.get("wall_material"));
        let index = |name: &str, default: Option<&toml::Value>| {
            let is_it =
                |table: &&toml::Table| table.get("name").and_then(|n| n.as_str()) == Some(name);
            let material = match named.iter().find(is_it) {
                Some(table) => table.get("material"),
                None => default,
            };
            all.iter().position(|table| table.get("name") == material).unwrap_or_default()
        };
        let of_shapes = header.shapes.iter().map(|shape| index(&shape.name, None)).collect();
        let of_walls = header.walls.iter().map(|wall| index(&wall.name, side)).collect();
        Self { all, of_shapes, of_walls }
    }
}
