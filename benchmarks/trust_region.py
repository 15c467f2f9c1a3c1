"""pymanopt's Riemannian trust region on the thesis's energy: the method that the thesis uses, in Python."""

from dataclasses import dataclass
from time import process_time

from benchmarks.measuring import Floats
from benchmarks.thesis_energy import ThesisEnergy

TIME_LIMIT = 20.0


@dataclass(frozen=True)
class Minimum:
    """frames: (n, 3, 3). energy: there. seconds: processor time."""

    frames: Floats
    energy: float
    seconds: float


def trust_region(energy: ThesisEnergy, limit: float = TIME_LIMIT) -> Minimum | None:
    """Minimise from the data on; stops after about `limit` seconds. None where pymanopt is not installed."""
    try:
        import pymanopt
    except ImportError:
        return None
    manifold = pymanopt.manifolds.SpecialOrthogonalGroup(3, k=len(energy.data))
    numpy_function = pymanopt.function.numpy(manifold)
    problem = pymanopt.Problem(
        manifold,
        numpy_function(lambda x: energy.cost(x)),
        euclidean_gradient=numpy_function(lambda x: energy.gradient(x)),
        euclidean_hessian=numpy_function(lambda x, change: energy.hessian(x, change)),
    )
    optimiser = pymanopt.optimizers.TrustRegions(verbosity=0, max_time=limit)
    begin = process_time()
    found = optimiser.run(problem, initial_point=energy.data)
    return Minimum(found.point, found.cost, process_time() - begin)
