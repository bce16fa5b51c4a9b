# SPDX-License-Identifier: Apache-2.0
"""Iterations per second of gsplat on train_bench's seeded scene: as many Gaussians, of the same shapes, before the same
camera. An iteration is what it is there: rasterization with SH degree 3, 0.8 L1 + 0.2 (1 - SSIM), backward, Adam.
Needs torch with CUDA and gsplat; takes fused_ssim and gsplat's own fused Adam where they are installed."""

import argparse
import math
import time

import torch
import torch.nn.functional as F
from gsplat import rasterization


def cloud(args, focal):
    """Ellipsoids of 1 : 3 : 10 in random directions, sized so that `splats` of them blend in a pixel."""
    generator = torch.Generator().manual_seed(1)
    n = args.gaussians

    def uniform(low, high, *shape):
        return torch.rand(*shape, generator=generator) * (high - low) + low

    sigma = math.sqrt(args.splats * args.width * args.height / n / 14.0) / focal * 4.0
    z = uniform(2.0, 6.0, n)
    x = (uniform(0.0, args.width, n) - args.width / 2) / focal * z
    y = (uniform(0.0, args.height, n) - args.height / 2) / focal * z
    sh = uniform(-0.5, 0.5, n, 16, 3) * 0.2
    sh[:, 0] *= 10.0
    return {
        "means": torch.stack([x, y, z], 1),
        "quats": F.normalize(torch.randn(n, 4, generator=generator), dim=1),
        "scales": torch.log(sigma * z[:, None] / 4.0 * torch.tensor([1.8, 0.6, 0.18])),
        "opacities": uniform(-3.5, -1.0, n),
        "sh": sh,
    }


def plain_ssim(a, b):
    """11 x 11 Gaussian window, one convolution a quantity."""
    taps = torch.exp(-((torch.arange(11.0, device=a.device) - 5) ** 2) / 4.5)
    taps = taps / taps.sum()
    window = (taps[:, None] * taps[None, :]).expand(3, 1, 11, 11).contiguous()

    def blur(x):
        return F.conv2d(x, window, padding=5, groups=3)

    ma, mb = blur(a), blur(b)
    va, vb, ab = blur(a * a) - ma * ma, blur(b * b) - mb * mb, blur(a * b) - ma * mb
    return (((2 * ma * mb + 1e-4) * (2 * ab + 9e-4)) / ((ma * ma + mb * mb + 1e-4) * (va + vb + 9e-4))).mean()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--width", type=int, default=800)
    parser.add_argument("--height", type=int, default=800)
    parser.add_argument("--gaussians", type=int, default=100_000)
    parser.add_argument("--splats", type=float, default=60.0, help="blended splats per pixel to aim at")
    parser.add_argument("--iterations", type=int, default=200)
    args = parser.parse_args()
    try:
        from fused_ssim import fused_ssim as ssim
    except ImportError:
        ssim = plain_ssim

    focal = args.height / 2 / math.tan(0.4)  # as the vertical field of view
    parameters = {k: v.cuda().requires_grad_() for k, v in cloud(args, focal).items()}
    rates = {"means": 1.6e-4, "quats": 1e-3, "scales": 5e-3, "opacities": 5e-2, "sh": 2.5e-3}
    optimiser = torch.optim.Adam([{"params": [parameters[k]], "lr": rates[k]} for k in rates], eps=1e-15, fused=True)
    camera = torch.tensor([[focal, 0, args.width / 2], [0, focal, args.height / 2], [0, 0, 1]], device="cuda")[None]
    view = torch.eye(4, device="cuda")[None]

    def draw():
        picture, _, _ = rasterization(
            parameters["means"], parameters["quats"], torch.exp(parameters["scales"]),
            torch.sigmoid(parameters["opacities"]), parameters["sh"], view, camera, args.width, args.height,
            sh_degree=3, packed=False)
        return picture.permute(0, 3, 1, 2)

    with torch.no_grad():
        target = (draw() + 0.1 * torch.rand(3, 1, 1, device="cuda")).clamp(0, 1).contiguous()

    def step():
        picture = draw().contiguous()
        loss = 0.8 * (picture - target).abs().mean() + 0.2 * (1 - ssim(picture, target))
        loss.backward()
        optimiser.step()
        optimiser.zero_grad(set_to_none=True)

    for _ in range(5):
        step()
    torch.cuda.synchronize()
    start = time.perf_counter()
    for _ in range(args.iterations):
        step()
    torch.cuda.synchronize()
    seconds = time.perf_counter() - start
    print(f"{args.iterations / seconds:.1f} it/s over {args.iterations} iterations, SSIM by {ssim.__name__}, "
          f"peak {torch.cuda.max_memory_allocated() / 2**20:.0f} MiB")


if __name__ == "__main__":
    main()
