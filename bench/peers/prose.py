"""The page's prose: what is measured and how, and where the limit is. Numbers that age carry their date."""

INTRODUCTION = """# Performance

For everybody who asks what gridpeers costs, beside what, and how far it is from the limit. One command measures all of
it in one run and writes this page, its figures and [performance.json](performance.json); another one has the long runs:

```sh
pip install -e '.[bench]'
python -m bench.peers --write docs       # {minutes}
python -m bench.long_runs --write docs   # a quarter of an hour: memory, files and time per tick of long runs
python -m bench.peers --page docs        # measures nothing: writes the page anew from performance.json
```

It measures the parts that are named, or all: {names}.
Each part is stored as soon as it is measured, with its date, commit, load and versions; a part that is measured again
replaces its numbers alone, and `--resume` measures those that are missing. What fails, or whose package is missing, is
left out and named; exit code 1 says that something failed.

Rivals take turns, round by round, each round in another order. A number is the median of the rounds, and a ratio the
median of the rounds' ratios; beside it stand the least and the largest round, and how many there were. Ratios hold from
machine to machine better than seconds do. Times in one process are processor time unless a row says otherwise; with
processes they are by the clock, so that other programs count: the load is stated, before and at most during a part, and
what other programs than the bench took of the processors.

The case: the islanding experiment, case IV, nine inverters with agents on the 123-node feeder, full graph, 7 s
simulated, T_c 20 ms, h 2 ms. A tick is one control period of the lock-step: 9 measurements, 72 states to neighbours, 9
to the plant. All meshes have the processes and the messages of ours, in number and size, and compute nothing; those of
HELICS ask for time once a tick, so that its federates see values one tick late, which is generous to HELICS. The
session of our plant relays all messages ([protocol.md](protocol.md#one-link-each)). So does the hub of bare Zenoh where
a row says so; elsewhere bare Zenoh has a link for each pair of processes.
"""

ALONE = """## What no rival has

The first case of a command is `gridpeers run` in a process of its own, from its start. Plant and agents of a further
case are forked from servers that the first has started.
"""

CRITERIA = """## What was asked for

The numbers of the issue that asked for speed. *Of the limit* is the measured number in proportion to the limit. Two of
its lines are no measurements: every driver and every number of processes gives the same bytes (`tests/golden`), and the
command above runs on a clean clone (`tests/peers` runs it shortly).
"""

LINKS = """A message is a state to a neighbour, or one from or to the plant; in one process it is handed over as it is.
Its cost is processor time of all but the plant: measurement, law, set-points, history. "Dearest size / cheapest" above
is the largest of these medians in proportion to the least, on a ring of 9, 30, 99 and 300 agents: 1 is a cost that does
not depend on their number. Its rounds have the noise of one measurement a size each, so that they may all be larger.
"""

LIMITS = """## Where the limit is

- **Plant.** The steps are one compiled loop; the limit is the solution with sparse factors, one iteration each, and the
  controllers; the build is limited by one sparse factorisation. GridLAB-D solves the whole network by Newton's method
  in every step; it is measured as it is installed. As the plant of our runs it keeps its solver's memory, which saves
  a quarter of its time ([plant.md](plant.md#gridlab-d-as-the-plant)).
- **Tick.** Bare Zenoh is the limit of any lock-step over Zenoh: its system calls and wakes, once a message and link.
  A relay writes what has come for an agent in one go, so that it saves most of them; agents that share a process save
  the rest. With three agents a process, 0.4 ms of a tick are those of bare Zenoh and 0.4 ms what one process takes
  for the same tick; what is left is codec and waiting for one another. On a virtual machine the same tick takes from
  1.0 to 1.7 ms within an hour: the table's value is the median of an idle one. ZeroMQ over Unix sockets shows what a
  transport without discovery, routing and TCP costs.
- **One process.** Where a link is emulated, or an agent joins, leaves or dies, each message costs its way through the
  same nodes that processes have (decode, checks, the law's sum). In all other runs no message decides anything, and
  there is none ([architecture.md](architecture.md#design-decisions-and-why)): a third of that cost remains. Either way
  it grows with links, not with pairs of agents.
- **Start.** Processor time: a command with processes takes 3.7 s of it, so two cores cannot be done before 1.9 s.
  Until the first row, 1.2 s: the process that forks plants 0.43 (numpy and scipy 0.2, our modules and Zenoh 0.16, LLVM
  and the compiled step 0.04, a first plant 0.03), the command itself 0.35, nearly all imports, the process that forks
  agents 0.12, nine agents and the plant with sessions and discovery 0.3. Then the ticks 0.8, what judges a run 0.15,
  matplotlib 0.37 and eight figures 0.95, on all cores; the rest is forks and ends of processes. In turns with commit
  c71129f, seven rounds at real-time priority on two busy cores (load 4 to 8): to the first row 0.70 s instead of 1.28
  s, to the last 1.40 instead of 1.86, to the end with tables and figures 2.02 instead of 3.39; processor time 3.7 s
  instead of 4.3 s. The same case with `--driver inprocess`: 1.6 s instead of 3.4 s.
"""

SCALE = """## From nine agents to 999 in one process

Joined copies of the feeder, islanded as one, ring, T_c 0.1 s, h 2 ms; processor seconds a simulated second, each number
of agents in a process of its own so that memory is its own (`python -m bench.scale` has other graphs, too). By the
clock, less than 1 is faster than real time. A message is a state to a neighbour, or one from or to the plant.
"""

SCALE_NOTES = """What bounds 999 agents in one island, 2026-11-23 (three rounds beside the state of the day before; load
6 to 9, held off by a real-time priority): 0.74 s of processor time a simulated second, 0.77 s by the clock; the day
before 1.27 s. 306 agents at 20 ms took 0.36 s instead of 0.97 s, 99 agents 0.08 s instead of 0.11 s, nine 8 ms instead
of 11 ms.

- The plant's steps take 0.5 s: 1000 network solutions of 0.32 ms where one iteration suffices, and of 0.51 ms with two,
  which is usual while the law moves set-points. 13 000 of 17 000 nodes are stepped; the others have no inverter. With
  all 17 000, solving with the factors (57 000 entries) would take 0.155 ms of an iteration of 0.22 ms. Controllers take
  0.09 ms a solution. An entry costs as much as with nine agents (1.4 ns each way): instructions are the limit, not the
  memory.
- The agents take 13 us each a tick with measurement and set-points, 7 to 9 of them for the law (4.5 where their objects
  fit the cache). With messages it is 45 us with 300 agents. The rows of the history take 0.08 s.
- One island has one core. Where the copies are islands of their own (`python -m bench.scale --apart 1`) the plant steps
  them on both: 0.56 s by the clock, 0.70 s of processor time.

Tried without gain: eliminating nodes level by level or subtree by subtree, a new tangent of the loads sooner, a
tolerance ten or a hundred times as wide (two iterations remain). LLVM's search for pairs of equal operations makes the
factors a fifth to a third faster, but numba has it off because its code was wrong at times (numba, pull request 8852).
"""

LONG_RUNS = """## Long runs

`python -m bench.long_runs` watches the anonymous memory of every process, the size of the files and the time per tick
of the islanding with nine agents; `links` has a delay on every link, and so a row in links.csv for each message. Growth
is from a fifth of the run to its end, at most of all processes; memory is the largest agent's, and a server is a
process that plant or agents are forked from. Processor time per tick of the last quarter is in proportion to the
first's, and other programs disturb it.
"""

LONG_NOTES = """`gridpeers check` and `gridpeers run` tell the size of a long run's files before it starts
([results.md](results.md)).
"""
