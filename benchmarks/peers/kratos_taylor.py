"""Runs Taylor's test with Kratos: `python benchmarks/peers/kratos_taylor.py MESH.npz`.

Needs `pip install KratosMultiphysics KratosStructuralMechanicsApplication KratosConstitutiveLawsApplication`.
"""

import numpy as np
import taylor

taylor.one_thread()

import KratosMultiphysics as KM  # noqa: E402, N817
import KratosMultiphysics.ConstitutiveLawsApplication as CLA  # noqa: E402, N817
import KratosMultiphysics.StructuralMechanicsApplication as SMA  # noqa: E402, N817

POINTS_OF_CURVE = 6  # hardening by a table of stress over strain
KM.Logger.GetDefaultOutput().SetSeverity(KM.Logger.Severity.WARNING)
model = KM.Model()
part = model.CreateModelPart("bar")
part.SetBufferSize(2)
part.ProcessInfo[KM.DOMAIN_SIZE] = 3
part.ProcessInfo[KM.COMPUTE_LUMPED_MASS_MATRIX] = True
for name in ("DISPLACEMENT", "VELOCITY", "ACCELERATION", "REACTION", "NODAL_MASS", "FORCE_RESIDUAL", "RESIDUAL_VECTOR"):
    part.AddNodalSolutionStepVariable(getattr(KM, name))
part.AddNodalSolutionStepVariable(KM.VOLUME_ACCELERATION)
part.AddNodalSolutionStepVariable(SMA.MIDDLE_VELOCITY)
points, bricks, foot = taylor.mesh()
copper = part.CreateNewProperties(1)
copper[KM.YOUNG_MODULUS], copper[KM.POISSON_RATIO], copper[KM.DENSITY] = taylor.E, taylor.NU, taylor.RHO
copper[KM.YIELD_STRESS] = taylor.YIELD
copper[KM.FRACTURE_ENERGY] = 1e20
copper[CLA.HARDENING_CURVE] = POINTS_OF_CURVE
curve = [taylor.YIELD, taylor.YIELD + 10.0 * taylor.HARDENING]
copper[CLA.EQUIVALENT_STRESS_VECTOR_PLASTICITY_POINT_CURVE] = KM.Vector(curve)
copper[CLA.TOTAL_STRAIN_VECTOR_PLASTICITY_POINT_CURVE] = KM.Vector([0.0, 10.0])
copper[KM.CONSTITUTIVE_LAW] = CLA.FiniteStrainIsotropicPlasticity3DVonMisesVonMises()
copper[KM.COMPUTE_LUMPED_MASS_MATRIX] = True
for k, x in enumerate(points):
    part.CreateNewNode(k + 1, *map(float, x))
for k, nodes in enumerate(bricks):
    part.CreateNewElement("TotalLagrangianElement3D8N", k + 1, [int(n) + 1 for n in nodes], copper)
for name in ("X", "Y", "Z"):
    dof, reaction = getattr(KM, f"DISPLACEMENT_{name}"), getattr(KM, f"REACTION_{name}")
    KM.VariableUtils().AddDof(dof, reaction, part)
scheme = SMA.ExplicitCentralDifferencesScheme(1.0, 1.0, 0)
strategy = SMA.MechanicalExplicitStrategy(part, scheme, False, False, True)  # without moving the mesh it does not yield
strategy.SetRebuildLevel(0)
strategy.SetEchoLevel(0)
for k in set(range(len(points))) - set(foot.tolist()):
    for variable in (KM.VELOCITY_X, SMA.MIDDLE_VELOCITY_X):
        for back in (0, 1):
            part.GetNode(k + 1).SetSolutionStepValue(variable, back, taylor.SPEED)
for k in foot.tolist():
    part.GetNode(k + 1).Fix(KM.DISPLACEMENT_X)
part.ProcessInfo[KM.DELTA_TIME] = taylor.DT
strategy.Initialize()
time, begun = 0.0, taylor.clock()
for _ in range(taylor.STEPS):
    time += taylor.DT
    part.CloneTimeStep(time)
    part.ProcessInfo[KM.STEP] += 1
    strategy.InitializeSolutionStep()
    strategy.Predict()
    strategy.SolveSolutionStep()
    strategy.FinalizeSolutionStep()
wall = taylor.clock() - begun
u = np.array([list(node.GetSolutionStepValue(KM.DISPLACEMENT)) for node in part.Nodes])
version = KM.Kernel.Version().split("-")[0].replace('"', "").rstrip(".")
taylor.say("Kratos", version, "TotalLagrangian3D8N", wall, len(bricks), taylor.shape(points, u, foot))
