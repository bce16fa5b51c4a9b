# SPDX-License-Identifier: Apache-2.0
"""What others published, for bench/report.py to put beside ours.

Tables A.2 to A.4 are of Chao et al., "Textured Gaussians for Enhanced 3D Scene Appearance Modeling", CVPR 2025. Scores
are (PSNR, SSIM); its LPIPS are left out, since it does not say which variant they are.
"""
# lego of NeRF-synthetic at 800 x 800, test views: what, PSNR, Gaussians where they are known.
LEGO_800 = [
    ("3DGS, published", 35.78, None),
    ("3DGS, run again by others", 35.70, None),
    ("3DGS with MCMC", 36.01, 325000),
    ("3DGUT, by its authors", 36.47, None),  # both: the README of github.com/nv-tlabs/3dgrut at a37ef72
    ("3DGRT, by its authors", 36.70, None),
]

# Table A.2, without textures and with 4 x 4 RGBA. Its "MB" are millions of parameters.
EFFICIENCY = {
    "gaussians": 2.12e6,
    "parameters": (125.3e6, 261.2e6),
    "memory": (2.4e9, 4.0e9),
    "frame": (73.0, 123.0),  # [ms]
}

# Table A.3, the number of texels fixed: share of the Gaussians [%]: 3DGS*, which has no texture, and RGBA.
SHARES = {
    "Blender": {
        1: ((26.89, 0.9160), (28.02, 0.9340)),
        2: ((28.44, 0.9320), (29.68, 0.9465)),
        5: ((30.09, 0.9491), (30.96, 0.9564)),
        10: ((31.47, 0.9590), (32.12, 0.9630)),
        20: ((32.21, 0.9637), (32.59, 0.9656)),
        50: ((32.77, 0.9664), (32.98, 0.9673)),
        100: ((33.09, 0.9671), (33.24, 0.9674)),
    },
    "Mip-NeRF 360": {
        1: ((22.37, 0.6293), (23.75, 0.7066)),
        2: ((23.43, 0.6816), (24.79, 0.7454)),
        5: ((24.88, 0.7450), (25.87, 0.7841)),
        10: ((25.77, 0.7796), (26.45, 0.8012)),
        20: ((26.45, 0.8057), (26.83, 0.8139)),
        50: ((27.02, 0.8250), (27.13, 0.8245)),
        100: ((27.28, 0.8318), (27.35, 0.8274)),
    },
}

# Table A.4: kinds of textures at two shares [%].
KINDS = {
    "Blender": {
        1: {"alpha": (27.64, 0.9304), "rgb": (27.60, 0.9279), "rgba": (28.11, 0.9343)},
        100: {"alpha": (33.22, 0.9672), "rgb": (33.20, 0.9673), "rgba": (33.24, 0.9674)},
    },
    "Mip-NeRF 360": {
        1: {"alpha": (23.69, 0.7012), "rgb": (23.50, 0.6971), "rgba": (23.73, 0.7064)},
        100: {"alpha": (27.32, 0.8259), "rgb": (27.30, 0.8268), "rgba": (27.35, 0.8274)},
    },
}
