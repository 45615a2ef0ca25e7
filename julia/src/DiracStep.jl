"""
Structure-preserving time stepping of systems with constraints, over libdiracstep: thin `ccall`s with the names that the
Python package has.

    using DiracStep
    skate = load("knife_edge")
    run = DiracStep.run(skate; step = 0.1, until = 10)
    run.q[1, end]
"""
module DiracStep

using Libdl

export load, parse_scene, integrator, step!, state, reset!, save, restore!, Scene, Integrator, Run

const interface_version = Cuint(8)  # DIRACSTEP_VERSION_OF_C_INTERFACE
const momenta = (projected = 0, plus = 1, minus = 2)
const library = Ref{String}("libdiracstep.so.0.1")

__init__() = (library[] = get(ENV, "DIRACSTEP_LIBRARY", library[]))

"A wrong name, size, value or start; the text is the library's."
struct Misuse <: Exception
    message::String
end
"A step that cannot be solved; the text is the library's."
struct Failure <: Exception
    message::String
end

# The structs of c_interface/diracstep.h, field by field.
struct Parameter
    name::Cstring
    value::Cdouble
end
struct Source
    name::Cstring
    text::Cstring
    callbacks::Ptr{Cvoid}
    parameters::Cint
    parameter::Ptr{Parameter}
    drop_redundant::Cint
    plugins::Cint
    plugin::Ptr{Cstring}
    linked::Cint
    linked_plugin::Ptr{Ptr{Cvoid}}
    tolerances::Cint
    tolerance::Ptr{Parameter}
end
struct Facts
    dimension::Cint
    storage::Cint
    rows::Cint
    invariants::Cint
    outputs::Cint
    start_time::Cdouble
    start_q::Ptr{Cdouble}
    start_v::Ptr{Cdouble}
    end_time::Cdouble
    step::Cdouble
    Facts() = new(0, 0, 0, 0, 0, 0.0, C_NULL, C_NULL, 0.0, 0.0)
end
struct Options
    method::Cstring
    order::Cint
    step::Cdouble
    ends::Cint
    end_::Cdouble
    rule::Cstring
    solver::Cstring
    jacobian::Cstring
    project_start::Cint
    substeps::Cint
    compensated_sums::Cint
    pushed::Cint
    fixed::Cint
    eps::Cdouble
    control::Cstring
    smallest_step::Cdouble
    max_steps::Clong
end
struct Table
    rows::Cint
    columns::Cint
    cells::Ptr{Cstring}
    Table() = new(0, 0, C_NULL)
end
mutable struct ReadState
    time::Cdouble
    energy::Cdouble
    q::Ptr{Cdouble}
    v::Ptr{Cdouble}
    p::Ptr{Cdouble}
    lambda::Ptr{Cdouble}
    invariants::Ptr{Cdouble}
    outputs::Ptr{Cdouble}
end
mutable struct Points
    room::Clong
    count::Clong
    t::Ptr{Cdouble}
    q::Ptr{Cdouble}
    v::Ptr{Cdouble}
    p::Ptr{Cdouble}
    lambda::Ptr{Cdouble}
    invariants::Ptr{Cdouble}
    outputs::Ptr{Cdouble}
    energy::Ptr{Cdouble}
    enlarge::Ptr{Cvoid}
    data::Ptr{Cvoid}
end
struct Course
    steps::Clong
    times::Cint
    time::Ptr{Cdouble}
    ends::Cint
    end_::Cdouble
    every::Clong
    momentum::Cint
    stop::Ptr{Cint}
end

symbol(name) = dlsym(dlopen(library[]), "diracstep_" * name)
message() = unsafe_string(ccall(symbol("message"), Cstring, ()))

function check(code::Cint)
    code == 0 && return
    throw(code == 2 ? Misuse(message()) : Failure(message()))
end

"A mechanical system with constraints, from a file, from text or of the catalogue."
mutable struct Scene
    handle::Ptr{Cvoid}
    coordinates::Vector{String}
    positions::Vector{String}  # of the numbers of q: the coordinates in R^n
    rows::Vector{String}
    start_time::Float64
    until::Float64
    step::Float64
end

function lines(handle, what)
    table = Ref(Table())
    check(ccall(symbol("list"), Cint, (Ptr{Cvoid}, Cint, Ref{Table}), handle, what, table))
    width = table[].columns
    [[unsafe_string(unsafe_load(table[].cells, (r - 1) * width + k)) for k in 1:width] for r in 1:table[].rows]
end

function open_scene(name, text, changes)
    names = String[string(key) for key in keys(changes)]
    handle = Ref{Ptr{Cvoid}}(C_NULL)
    GC.@preserve names name text begin
        parameters = [Parameter(Base.unsafe_convert(Cstring, names[k]), value) for (k, value) in enumerate(values(changes))]
        pointer_of(string) = string === nothing ? Cstring(C_NULL) : Base.unsafe_convert(Cstring, string)
        GC.@preserve parameters begin
            source = Ref(Source(pointer_of(name), pointer_of(text), C_NULL, length(parameters), pointer(parameters), 0, 0, C_NULL,
                                0, C_NULL, 0, C_NULL))
            check(ccall(symbol("open"), Cint, (Cuint, Ref{Source}, Ref{Ptr{Cvoid}}), interface_version, source, handle))
        end
    end
    facts = Ref(Facts())
    check(ccall(symbol("read_facts"), Cint, (Ptr{Cvoid}, Ref{Facts}), handle[], facts))
    scene = Scene(handle[], first.(lines(handle[], 1)), first.(lines(handle[], 12)), first.(lines(handle[], 2)), facts[].start_time, facts[].end_time,
                  facts[].step)
    finalizer(made -> ccall(symbol("close"), Cvoid, (Ptr{Cvoid},), made.handle), scene)
end

"A scene of the catalogue, or from a file NAME.toml; parameters by keyword."
load(name::AbstractString; parameters...) = open_scene(String(name), nothing, values(parameters))
"A scene from the text of a scene file."
parse_scene(text::AbstractString; parameters...) = open_scene("text", String(text), values(parameters))

"Steps a scene with one method; belongs to one task at a time."
mutable struct Integrator
    handle::Ptr{Cvoid}
    scene::Scene
end

"An integrator at the scene's start; steps are of one size, which `until` fits to the end, unless `eps` above 0 lets them vary."
function integrator(scene::Scene; method = nothing, order = 0, step = 0.0, until = nothing, eps = 0.0)
    handle = Ref{Ptr{Cvoid}}(C_NULL)
    none = Cstring(C_NULL)
    name = method === nothing ? nothing : String(method)
    GC.@preserve name begin
        options = Ref(Options(name === nothing ? none : Base.unsafe_convert(Cstring, name), order, step, until === nothing ? 0 : 1,
                              until === nothing ? 0.0 : until, none, none, none, 0, 0, 0, 0, eps == 0 ? 1 : 0, eps, none, 0.0, 0))
        check(ccall(symbol("create"), Cint, (Ptr{Cvoid}, Ref{Options}, Ref{Ptr{Cvoid}}), scene.handle, options, handle))
    end
    finalizer(made -> ccall(symbol("destroy"), Cvoid, (Ptr{Cvoid},), made.handle), Integrator(handle[], scene))
end

"Takes so many steps."
step!(made::Integrator, count = 1) = check(ccall(symbol("step"), Cint, (Ptr{Cvoid}, Clong), made.handle, count))

"The current point: t, q, v, p, lambda, energy."
function state(made::Integrator; momentum = :projected)
    n, m = length(made.scene.coordinates), length(made.scene.rows)
    q, v, p, lambda = zeros(length(made.scene.positions)), zeros(n), zeros(n), zeros(m)
    GC.@preserve q v p lambda begin
        read = Ref(ReadState(0.0, 0.0, pointer(q), pointer(v), pointer(p), pointer(lambda), C_NULL, C_NULL))
        check(ccall(symbol("read"), Cint, (Ptr{Cvoid}, Cint, Ref{ReadState}), made.handle, momenta[momentum], read))
    end
    (t = read[].time, q = q, v = v, p = p, lambda = lambda, energy = read[].energy)
end

"Goes back to the scene's start."
reset!(made::Integrator) =
    check(ccall(symbol("reset"), Cint, (Ptr{Cvoid}, Cdouble, Ptr{Cdouble}, Ptr{Cdouble}), made.handle, 0.0, C_NULL, C_NULL))

"All that the next steps depend on, as bytes."
function save(made::Integrator)
    size = Ref{Csize_t}(0)
    check(ccall(symbol("save"), Cint, (Ptr{Cvoid}, Ptr{UInt8}, Csize_t, Ref{Csize_t}), made.handle, C_NULL, 0, size))
    bytes = Vector{UInt8}(undef, size[])
    check(ccall(symbol("save"), Cint, (Ptr{Cvoid}, Ptr{UInt8}, Csize_t, Ref{Csize_t}), made.handle, bytes, length(bytes), size))
    bytes
end

"Goes on from `save`, with the same bits."
restore!(made::Integrator, bytes::Vector{UInt8}) =
    check(ccall(symbol("restore"), Cint, (Ptr{Cvoid}, Ptr{UInt8}, Csize_t), made.handle, bytes, length(bytes)))

"Points of a motion: column k of each matrix is point k."
struct Run
    t::Vector{Float64}
    q::Matrix{Float64}
    v::Matrix{Float64}
    p::Matrix{Float64}
    lambda::Matrix{Float64}
    energy::Vector{Float64}
    doubt::String  # empty, or why the points are not to be believed
end

"One motion from the scene's start with a fixed step, fitted to end at `until`."
function run(scene::Scene; until = scene.until, every = 1, momentum = :projected, options...)
    made = integrator(scene; until = until, options...)
    course = Ref(Course(0, 0, C_NULL, 1, until, every, momenta[momentum], C_NULL))
    room = ccall(symbol("expect"), Clong, (Ptr{Cvoid}, Ref{Course}), made.handle, course)
    room > 0 || throw(Misuse("run needs steps of fixed size; step an integrator where they vary"))
    n, m = length(scene.coordinates), length(scene.rows)
    s = length(scene.positions)
    t, energy, q, v, p, lambda = zeros(room), zeros(room), zeros(s, room), zeros(n, room), zeros(n, room), zeros(m, room)
    GC.@preserve t energy q v p lambda begin
        points = Ref(Points(room, 0, pointer(t), pointer(q), pointer(v), pointer(p), pointer(lambda), C_NULL, C_NULL, pointer(energy),
                            C_NULL, C_NULL))
        check(ccall(symbol("run"), Cint, (Ptr{Cvoid}, Ref{Course}, Ref{Points}), made.handle, course, points))
    end
    kept = 1:points[].count
    doubt = unsafe_string(ccall(symbol("doubt"), Cstring, (Ptr{Cvoid},), made.handle))
    isempty(doubt) || @warn doubt
    Run(t[kept], q[:, kept], v[:, kept], p[:, kept], lambda[:, kept], energy[kept], doubt)
end

end
