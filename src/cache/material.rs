//! The material of the curves of a cache.
//!
//! Every cache has it at the same path below `/groom`, where a stage that references the cache can replace
//! its shader. The default is a UsdPreviewSurface with `primvars:displayColor` as diffuse colour.

use crate::usd::{Attribute, Prim, Relationship, Specifier, Value};

/// Name of the scope below `/groom`, and of the material in it.
const SCOPE: &str = "materials";
const NAME: &str = "hair";

/// Binds a prim of curves to the material.
pub(super) fn bind(curves: &mut Prim) {
    curves.metadata.push(("apiSchemas".into(), Value::PrependedTokens(vec!["MaterialBindingAPI".into()])));
    curves
        .relationships
        .push(Relationship { name: "material:binding".into(), targets: Some(vec![path("")]) });
}

/// The scope with the material.
pub(super) fn scope() -> Prim<'static> {
    let output = |name: &str, type_name: &str| Attribute::new(&format!("outputs:{name}"), type_name);
    let mut surface = shader("surface", "UsdPreviewSurface");
    surface.attributes.extend([
        Attribute::new("inputs:diffuseColor", "color3f").with_connection(&path("/colour.outputs:result")),
        output("surface", "token"),
    ]);
    let mut reader = shader("colour", "UsdPrimvarReader_float3");
    reader.attributes.extend([
        Attribute::new("inputs:varname", "string").with_default(Value::string("displayColor")),
        output("result", "float3"),
    ]);
    let mut material = Prim::new(Specifier::Def, "Material", NAME);
    material.attributes = vec![output("surface", "token").with_connection(&path("/surface.outputs:surface"))];
    material.children = vec![surface, reader];
    let mut scope = Prim::new(Specifier::Def, "Scope", SCOPE);
    scope.children = vec![material];
    scope
}

/// Path of the material followed by `below`.
fn path(below: &str) -> String {
    format!("/groom/{SCOPE}/{NAME}{below}")
}

fn shader(name: &str, id: &str) -> Prim<'static> {
    let mut shader = Prim::new(Specifier::Def, "Shader", name);
    shader.attributes = vec![Attribute::new("info:id", "token").uniform().with_default(Value::token(id))];
    shader
}
