using DiracStep
using Test

@testset "thin calls" begin
    skate = load("knife_edge")
    @test skate.coordinates == ["x", "y", "ph"]
    @test skate.rows == ["blade"]
    motion = DiracStep.run(skate; method = "type1/gl:3", step = 0.1, until = 1.0)
    @test length(motion.t) == 11 && motion.t[end] ≈ 1.0
    made = integrator(skate; method = "type1/gl:3", step = 0.1)
    step!(made, 10)
    @test state(made).q == motion.q[:, end]
    saved = save(made)
    step!(made)
    first_time = state(made).q
    restore!(made, saved)
    step!(made)
    @test state(made).q == first_time
    reset!(made)
    @test state(made).t == 0.0
    @test load("knife_edge"; g_sin_alpha = 0.5) isa Scene
    top = load("heavy_top_so3")
    turned = DiracStep.run(top; method = "type1/gl:3", step = 0.001, until = 0.01)
    @test size(turned.q, 1) == length(top.positions) == 4 && size(turned.v, 1) == length(top.coordinates) == 3
    @test_throws DiracStep.Misuse load("no_such_scene")
    @test_throws DiracStep.Misuse integrator(skate; method = "type9/none")
    spring = "name = \"spring\"\nlagrangian = \"v_x^2/2 - x^2/2\"\n[coordinates]\nx = {}\n[start]\nx = 1\n[span]\nend = 1\nstep = 0.1\n"
    @test DiracStep.run(parse_scene(spring)).q[1, end] ≈ cos(1.0) atol = 1e-6
end
