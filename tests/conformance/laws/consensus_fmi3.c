/* The paper's law, (12)-(15), as an FMU of FMI 3.0 for co-simulation, in the order of operations of
 * agents/laws/consensus.py. `consensus_fmi3.py` writes its model description and builds it with -ffp-contract=off. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

enum { MOST = 16, INSTANTIATED = 0, INITIALIZING, STEPPING, TERMINATED };

/* Value references, in the order of `NAMES` in consensus_fmi3.py. */
enum { TIME, PERIOD, NEIGHBOURS, LEADER, E, Z, V, P_SET, V_SET, M_P, K_P, K_Q, OUT_P_SET, OUT_V_SET, FIRST };
enum { WEIGHT, OF_P_SET, OF_Q, OF_M_P, OF_M_Q, PER_NEIGHBOUR };
enum { COUNT = FIRST + MOST * PER_NEIGHBOUR };

struct law {
    int state;
    double x[COUNT];
};

static void begin(struct law *law)
{
    memset(law, 0, sizeof *law);
    law->x[K_P] = 0.0007;
    law->x[K_Q] = 0.25;
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean events,
    fmi3Boolean early, const fmi3ValueReference required[], size_t count, fmi3InstanceEnvironment environment,
    fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    struct law *law = strcmp(token, "consensus-fmi3") ? NULL : malloc(sizeof *law);
    (void)name, (void)resources, (void)visible, (void)logging, (void)events, (void)early, (void)required, (void)count;
    (void)environment, (void)log, (void)update;
    if (law)
        begin(law);
    return law;
}

void fmi3FreeInstance(fmi3Instance instance) { free(instance); }

/* The standard's state machine: a call out of turn is an error. */
static fmi3Status become(struct law *law, int from, int to)
{
    if (law->state != from)
        return fmi3Error;
    law->state = to;
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(
    fmi3Instance instance, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 start, fmi3Boolean has_stop,
    fmi3Float64 stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    ((struct law *)instance)->x[TIME] = start;
    return become(instance, INSTANTIATED, INITIALIZING);
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) { return become(instance, INITIALIZING, STEPPING); }

fmi3Status fmi3Terminate(fmi3Instance instance) { return become(instance, STEPPING, TERMINATED); }

fmi3Status fmi3Reset(fmi3Instance instance)
{
    begin(instance);
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(
    fmi3Instance instance, const fmi3ValueReference references[], size_t count, const fmi3Float64 values[], size_t n)
{
    struct law *law = instance;
    if (count != n)
        return fmi3Error;
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= COUNT || references[i] == TIME || references[i] == OUT_P_SET || references[i] == OUT_V_SET)
            return fmi3Error;
        law->x[references[i]] = values[i];
    }
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(
    fmi3Instance instance, const fmi3ValueReference references[], size_t count, fmi3Float64 values[], size_t n)
{
    const struct law *law = instance;
    if (count != n)
        return fmi3Error;
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= COUNT)
            return fmi3Error;
        values[i] = law->x[references[i]];
    }
    return fmi3OK;
}

static double limited(double x, double least, double most) { return x < least ? least : x > most ? most : x; }

fmi3Status fmi3DoStep(
    fmi3Instance instance, fmi3Float64 now, fmi3Float64 step, fmi3Boolean no_state, fmi3Boolean *event,
    fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last)
{
    struct law *law = instance;
    double *x = law->x, y = 0.0, z = 0.0, d = 0.0, change, a, b, alpha = x[LEADER] > 0.5 ? 1.0 : 0.0;
    double T = x[PERIOD], kappa = x[M_P] / x[K_P];
    (void)no_state;
    *event = *terminate = *early = false;
    *last = x[TIME] = now + step;
    if (law->state != STEPPING || x[NEIGHBOURS] > MOST)
        return fmi3Error;
    for (int i = 0; i < (int)x[NEIGHBOURS]; i++) {
        const double *other = x + FIRST + i * PER_NEIGHBOUR;
        y += other[WEIGHT] * other[OF_M_P] * other[OF_P_SET];
        z += other[WEIGHT] * other[OF_M_Q] * other[OF_Q];
        d += other[WEIGHT];
    }
    y = d != 0.0 ? y / d : 0.0;
    z = d != 0.0 ? z / d : 0.0;
    change = 0.5 * (1.0 - exp(-2.0 * kappa * d * T)) * (y - x[M_P] * x[P_SET]);
    if (alpha > 0.0)
        change -= (1.0 - exp(-kappa * T)) * x[E];
    x[OUT_P_SET] = limited(x[P_SET] + change / x[M_P], 0.0, 1.0);
    if (alpha > 2.0 * d) {
        b = 1.0 - exp(-alpha * T / x[K_Q]);
        a = b * d / alpha;
    } else {
        a = 0.5 * (1.0 - exp(-2.0 * (1.0 / x[K_Q]) * d * T));
        b = d > 0.0 ? a * alpha / d : 0.0;
    }
    change = -a * (x[Z] - z);
    if (alpha > 0.0)
        change -= b * (x[V] - 1.0);
    x[OUT_V_SET] = limited(x[V_SET] + change, 0.9, 1.1);
    return fmi3OK;
}
