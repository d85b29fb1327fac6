"""Physics of hairbake's rod against independent solutions: studies, reference solvers, report page."""
