/* The paper's law, (12)-(15), as a program: lines of JSON as docs/how-to/law-programs.md says.
 *
 *     cc -std=c99 -O2 -ffp-contract=off paper_law.c -o law -lm
 *
 *     [case.IV]
 *     law = { command = ["./law"], k_p = 0.0007 }
 *
 * The order of operations is that of agents/laws/consensus.py, so the history is the same to the byte. For that
 * -ffp-contract=off keeps the compiler from fusing a multiplication and an addition into one, which rounds once less.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { LONGEST = 1 << 20 }; /* bytes of a line: 1000 neighbours with all shared values need half of it */

/* ---- JSON: enough of it to find a member of an object, and to walk over an array --------------------------------- */

static const char *blank(const char *s) { return s + strspn(s, " \t\r\n"); }

/* Return the end of the value at s; NULL if there is no value. */
static const char *skip(const char *s)
{
    s = blank(s);
    if (*s == '"') {
        for (s++; *s && *s != '"'; s++)
            if (*s == '\\' && s[1])
                s++;
        return *s ? s + 1 : NULL;
    }
    if (*s == '{' || *s == '[') {
        char close = *s == '{' ? '}' : ']';
        s = blank(s + 1);
        while (s && *s && *s != close) {
            s = *s == ',' || *s == ':' ? s + 1 : skip(s);
            s = s ? blank(s) : NULL;
        }
        return s && *s ? s + 1 : NULL;
    }
    size_t length = strcspn(s, ",:]} \t\r\n");
    return length ? s + length : NULL;
}

/* Return the value of a member of the object at s; NULL if there is none. */
static const char *member(const char *s, const char *name)
{
    size_t length = strlen(name);
    if (!s || *(s = blank(s)) != '{')
        return NULL;
    for (s = blank(s + 1); *s == '"';) {
        const char *key = s + 1, *after = skip(s), *value;
        if (!after || *(after = blank(after)) != ':')
            return NULL;
        value = blank(after + 1);
        if (!strncmp(key, name, length) && key[length] == '"')
            return value;
        if (!(s = skip(value)) || *(s = blank(s)) != ',')
            return NULL;
        s = blank(s + 1);
    }
    return NULL;
}

static int is(const char *value, const char *word) { return value && !strncmp(value, word, strlen(word)); }

/* Return a number of the object at s, or the default if it has none of this name. */
static double number_or(const char *s, const char *name, double otherwise)
{
    const char *value = member(s, name);
    return value ? strtod(value, NULL) : otherwise;
}

static double number(const char *s, const char *name) { return number_or(s, name, NAN); }

/* ---- the law ----------------------------------------------------------------------------------------------------- */

struct gains {
    double k_p, k_q, alpha, beta_GFM, beta_GFL, alpha_min, V_full, kappa_c, P_set_min, P_set_max, V_set_min, V_set_max;
};

static struct gains gains_of(const char *given)
{
    struct gains g = {
        number_or(given, "k_p", 0.0007),   number_or(given, "k_q", 0.25),      number_or(given, "alpha", 1.0),
        number_or(given, "beta_GFM", 1.0), number_or(given, "beta_GFL", 1.0),  number_or(given, "alpha_min", 0.0),
        number_or(given, "V_full", 0.0),   number_or(given, "kappa_c", 0.0),   number_or(given, "P_set_min", 0.0),
        number_or(given, "P_set_max", 1.0), number_or(given, "V_set_min", 0.9), number_or(given, "V_set_max", 1.1),
    };
    return g;
}

static double least(double a, double b) { return b < a ? b : a; }
static double most(double a, double b) { return b > a ? b : a; }

/* Return the part of the way to the neighbours' mean in one period. */
static double towards(double rate, double d, double T) { return 0.5 * (1.0 - exp(-2.0 * rate * d * T)); }

static double P_set_step(const struct gains *g, const char *own, double y_bar, double d, double T)
{
    double P_set = number(own, "P_set"), m_p = number(own, "m_p"), e = number(own, "e"), kappa = m_p / g->k_p;
    double change = towards(g->kappa_c != 0.0 ? g->kappa_c : kappa, d, T) * (y_bar - m_p * P_set);
    if (is(member(own, "leader"), "true") && -e * number(own, "P_saturated") <= 0.0)
        change -= (1.0 - exp(-kappa * T)) * e;
    return least(most(P_set + change / m_p, g->P_set_min), g->P_set_max);
}

static double V_set_step(const struct gains *g, const char *own, double z_bar, double d, double T)
{
    double V_set = number(own, "V_set"), v = number(own, "V"), alpha = 0.0, beta = g->beta_GFL, a, b, change, next;
    int leader = is(member(own, "leader"), "true");
    if (leader) {
        alpha = g->alpha;
        beta = g->beta_GFM;
        if (g->V_full > 0.0)
            alpha = most(g->alpha_min, alpha * least(1.0, fabs(v - 1.0) / g->V_full));
    }
    if (alpha > 2.0 * (beta * d)) {
        b = 1.0 - exp(-alpha * T / g->k_q);
        a = b * (beta * d) / alpha;
    } else {
        a = towards(beta / g->k_q, d, T);
        b = beta * d > 0.0 ? a * alpha / (beta * d) : 0.0;
    }
    change = -a * (number(own, "z") - z_bar);
    if (leader)
        change -= b * (v - 1.0);
    next = least(most(V_set + change, g->V_set_min), g->V_set_max);
    return (next - V_set) * number(own, "V_saturated") > 0.0 ? V_set : next;
}

static void step(const struct gains *g, const char *line)
{
    const char *own = member(line, "own"), *other = member(line, "neighbours");
    double T = number(line, "T"), y = 0.0, z = 0.0, d = 0.0, P_set, V_set;
    int count = 0;
    if (is(other, "["))
        for (other = blank(other + 1); *other == '{'; count++) {
            double weight = number(other, "weight");
            y += weight * number(other, "m_p") * number(other, "P_set");
            z += weight * number(other, "m_q") * number(other, "Q");
            d += weight;
            if (!(other = skip(other)) || *(other = blank(other)) != ',')
                break;
            other = blank(other + 1);
        }
    y = d != 0.0 ? y / d : 0.0;
    z = d != 0.0 ? z / d : 0.0;
    if (d != 0.0 && g->kappa_c != 0.0)
        d = d / count;
    P_set = P_set_step(g, own, y, d, T);
    V_set = V_set_step(g, own, z, d, T);
    if (isfinite(P_set) && isfinite(V_set))
        printf("{\"P_set\":%.17g,\"V_set\":%.17g}\n", P_set, V_set); /* 17 digits distinguish every double */
    else
        puts("{\"error\":\"a number is missing, or what follows from them is none\"}");
}

int main(void)
{
    static char line[LONGEST];
    struct gains g = gains_of("{}");
    while (fgets(line, sizeof line, stdin)) {
        const char *type = member(line, "type");
        if (is(type, "\"start\"")) {
            g = gains_of(member(line, "parameters"));
            puts("{\"type\":\"ready\"}");
        } else if (is(type, "\"step\""))
            step(&g, line);
        else
            puts("{\"error\":\"neither start nor step\"}");
        fflush(stdout); /* else the answer stays in a buffer while the agent waits */
    }
    return 0;
}
