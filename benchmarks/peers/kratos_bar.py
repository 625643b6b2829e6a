"""Runs the bar with Kratos: `python benchmarks/peers/kratos_bar.py`.

Needs `pip install KratosMultiphysics KratosStructuralMechanicsApplication`.
"""

import bar

if bar.PLASTIC:
    raise SystemExit("its plastic laws are in another application")
bar.one_thread()

import KratosMultiphysics as KM  # noqa: E402, N817
import KratosMultiphysics.StructuralMechanicsApplication as SMA  # noqa: E402, N817

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
points, bricks, stopped, free = bar.mesh()
steel = part.CreateNewProperties(1)
steel[KM.YOUNG_MODULUS], steel[KM.POISSON_RATIO], steel[KM.DENSITY] = bar.E, bar.NU, bar.RHO
steel[KM.CONSTITUTIVE_LAW] = SMA.LinearElastic3DLaw()
steel[KM.COMPUTE_LUMPED_MASS_MATRIX] = True
for k, x in enumerate(points):
    part.CreateNewNode(k + 1, *map(float, x))
for k, nodes in enumerate(bricks):
    part.CreateNewElement("SmallDisplacementElement3D8N", k + 1, [int(n) + 1 for n in nodes], steel)
for name in ("X", "Y", "Z"):
    dof, reaction = getattr(KM, f"DISPLACEMENT_{name}"), getattr(KM, f"REACTION_{name}")
    KM.VariableUtils().AddDof(dof, reaction, part)
scheme = SMA.ExplicitCentralDifferencesScheme(1.0, 1.0, 0)
strategy = SMA.MechanicalExplicitStrategy(part, scheme, False, False, False)
strategy.SetRebuildLevel(0)
strategy.SetEchoLevel(0)
moving = set(range(len(points))) - set(stopped.tolist())
for k in moving:
    for variable in (KM.VELOCITY_X, SMA.MIDDLE_VELOCITY_X):
        for back in (0, 1):
            part.GetNode(k + 1).SetSolutionStepValue(variable, back, -bar.SPEED)
for k in stopped.tolist():
    part.GetNode(k + 1).Fix(KM.DISPLACEMENT_X)
part.ProcessInfo[KM.DELTA_TIME] = bar.DT
strategy.Initialize()
ends, wall, time = [], 0.0, 0.0
for _ in bar.SAMPLES:
    begun = bar.clock()
    for _ in range(bar.STEPS // len(bar.SAMPLES)):
        time += bar.DT
        part.CloneTimeStep(time)
        part.ProcessInfo[KM.STEP] += 1
        strategy.InitializeSolutionStep()
        strategy.Predict()
        strategy.SolveSolutionStep()
        strategy.FinalizeSolutionStep()
    wall += bar.clock() - begun
    u = [part.GetNode(int(k) + 1).GetSolutionStepValue(KM.DISPLACEMENT_X) for k in free]
    ends.append(sum(u) / len(u))
bar.say("Kratos", KM.Kernel.Version().split("-")[0].replace('"', "").rstrip("."), "SmallDisplacement3D8N", wall, ends)
