//! Options for the material of strands.

use super::values;
use crate::scene::{Material, RodSection};
use clap::Args;

/// The material of the strands.
#[derive(Debug, Args)]
#[command(next_help_heading = "Material (defaults: human scalp hair)")]
pub struct MaterialArguments {
    /// Young's modulus, in GPa [default: 3.89]
    ///
    /// Raising it stiffens the hair against bending.
    #[arg(long, value_name = "GPA", value_parser = values::positive)]
    young: Option<f64>,
    /// Shear modulus, in GPa [default: 0.89]
    ///
    /// Raising it stiffens the hair against twisting.
    #[arg(long, value_name = "GPA", value_parser = values::positive)]
    shear: Option<f64>,
    /// Density, in kg/m³ [default: 1320]
    ///
    /// Raising it makes the hair hang lower.
    #[arg(long, value_name = "KG/M3", value_parser = values::positive)]
    density: Option<f64>,
    /// Diameter of a hair, in µm [default: 80]
    ///
    /// Stiffness grows with its fourth power, weight with its square.
    #[arg(long, value_name = "UM", value_parser = values::positive)]
    diameter: Option<f64>,
    /// Internal damping time, in seconds [default: 0.005]
    ///
    /// Raising it calms bouncing sooner.
    #[arg(long, value_name = "SECONDS", value_parser = values::not_negative)]
    damping: Option<f64>,
    /// Coulomb friction coefficient against bodies [default: 0.3]
    ///
    /// Raising it holds the hair on bodies longer.
    #[arg(long, value_name = "MU", value_parser = values::not_negative)]
    friction: Option<f64>,
    /// Scale factor for air drag; 0 for none [default: 1]
    ///
    /// Raising it makes the hair follow the air more closely.
    #[arg(long, value_name = "FACTOR", value_parser = values::not_negative)]
    drag: Option<f64>,
    /// Fraction of gravity that the rest shape compensates where no body carries the hair, 0 to 1
    ///
    /// 1 keeps the style of the groom at rest, with hair that is stiffer near its root if necessary; hair
    /// that lies on other hair sinks to the skin. 0 lets all hair sag.
    #[arg(long, value_name = "FRACTION", default_value_t = 1.0, value_parser = values::fraction)]
    sag_free: f64,
}

impl MaterialArguments {
    /// These properties, and others as by default.
    pub fn material(self, default: Material) -> Material {
        let section = self.diameter.map(|microns| 0.5e-6 * microns).map(|a| RodSection { a1: a, a2: a });
        Material {
            young_modulus: self.young.map_or(default.young_modulus, |gpa| gpa * 1e9),
            shear_modulus: self.shear.map_or(default.shear_modulus, |gpa| gpa * 1e9),
            density: self.density.unwrap_or(default.density),
            section: section.unwrap_or(default.section),
            damping: self.damping.unwrap_or(default.damping),
            friction: self.friction.map_or(default.friction, Into::into),
            drag: self.drag.unwrap_or(default.drag),
            sag_free: self.sag_free,
            ..default
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{CommandFactory, Parser};

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        material: MaterialArguments,
    }

    #[test]
    fn the_help_states_the_default_material() {
        let default = Material::default();
        let command = Line::command();
        let mut words = vec!["hairbake".to_string()];
        for argument in
            command.get_arguments().filter(|a| !matches!(a.get_id().as_str(), "help" | "sag_free"))
        {
            let help = argument.get_help().unwrap().to_string();
            let stated = help.split_once("[default: ").unwrap().1.trim_end_matches(']');
            words.extend([format!("--{}", argument.get_long().unwrap()), stated.into()]);
        }
        let stated = Line::parse_from(words).material.material(Material::default());
        let values = |m: &Material| {
            [m.young_modulus, m.shear_modulus, m.density, m.section.a1, m.damping, m.friction.mu_k, m.drag]
        };
        for (stated, default) in values(&stated).into_iter().zip(values(&default)) {
            approx::assert_relative_eq!(stated, default, max_relative = 1e-12);
        }
    }
}
