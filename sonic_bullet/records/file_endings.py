"""How the names of scenes' files end."""

GLTF_ENDINGS = (".gltf", ".glb")
SCENE_ENDINGS = (".py", *GLTF_ENDINGS)
