"""Faults of the material and of what binds curves to it, each with the checks that must catch it."""

from pxr import UsdShade

HAIR, GUIDES, MATERIAL = "/groom/hair", "/groom/guides", "/groom/materials/hair"


def no_binding(cache):
    cache.edit_topology(lambda stage: stage.GetPrimAtPath(HAIR).RemoveProperty("material:binding"))


def binding_without_its_schema(cache):
    cache.edit_topology(lambda stage: stage.GetPrimAtPath(GUIDES).RemoveAPI(UsdShade.MaterialBindingAPI))


def binding_to_what_is_no_material(cache):
    def change(stage):
        stage.GetPrimAtPath(GUIDES).GetRelationship("material:binding").SetTargets(["/groom/materials/skin"])

    cache.edit_topology(change)


def material_outside_of_the_groom(cache):
    def change(stage):
        other = UsdShade.Material.Define(stage, "/lookdev/hair")
        surface = UsdShade.Shader.Get(stage, f"{MATERIAL}/surface")
        other.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
        UsdShade.MaterialBindingAPI(stage.GetPrimAtPath(HAIR)).Bind(other)

    cache.edit_topology(change)


def material_without_a_surface(cache):
    cache.edit_topology(lambda stage: stage.GetPrimAtPath(MATERIAL).RemoveProperty("outputs:surface"))


MATERIAL_DEFECTS = [
    (["material"], no_binding),
    (["material", "framework"], binding_without_its_schema),
    (["material", "framework"], binding_to_what_is_no_material),
    (["material"], material_outside_of_the_groom),
    (["material"], material_without_a_surface),
]
