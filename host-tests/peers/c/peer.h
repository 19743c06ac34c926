/* What every peer in C and C++ has around its integrator: the problem, the clock, the result.
 *
 *     peer PROBLEM METHOD SETTING RUNS OUT
 *
 * runs the problem RUNS times, prints the CPU time of the quickest run in seconds, and writes the states at the end
 * of every hold to OUT as native doubles. `peer --version` prints the version of the library. */
#ifndef PEER_H
#define PEER_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

#define restrict __restrict__
#include "plant.h"

struct problem {
    struct plant plant;
    double hold_s;
    int holds;
    double start[STATES];
    struct load *loads;
};

/* A peer has these two: its version, and a run that leaves the states of all holds in `out`. Not 0 is a failure. */
static const char *version(void);
static int run(const struct problem *problem, const char *method, double setting, double *out);

static void give_up(const char *why, const char *what)
{
    fprintf(stderr, "%s: %s\n", why, what);
    exit(2);
}

/* Numbers of a line `name number…`, which must come next. */
static void numbers(FILE *file, const char *name, double *values, int count)
{
    char found[64];
    if (fscanf(file, "%63s", found) != 1 || strcmp(found, name) != 0) give_up("the problem lacks", name);
    for (int i = 0; i < count; i++)
        if (fscanf(file, "%lf", &values[i]) != 1) give_up("the problem has too few numbers", name);
}

static struct problem problem_of(const char *path)
{
    struct problem problem;
    struct plant *p = &problem.plant;
    double holds;
    FILE *file = fopen(path, "r");
    if (!file) give_up("cannot read", path);
    numbers(file, "per_length", p->per_length, SPANS);
    numbers(file, "stiffness", &p->stiffness, 1);
    numbers(file, "viscosity", p->viscosity, SPANS);
    numbers(file, "per_mass", p->per_mass, 2);
    numbers(file, "friction", p->friction, 2);
    numbers(file, "uw_inertia", &p->uw_inertia, 1);
    numbers(file, "uw_offset", &p->uw_offset, 1);
    numbers(file, "uw_friction", &p->uw_friction, 1);
    numbers(file, "layer", &p->layer, 1);
    numbers(file, "core", &p->core, 1);
    numbers(file, "drums", &p->drums, 1);
    numbers(file, "windup_friction", &p->windup_friction, 1);
    numbers(file, "hold_s", &problem.hold_s, 1);
    numbers(file, "start", problem.start, STATES);
    numbers(file, "holds", &holds, 1);
    problem.holds = (int)holds;
    problem.loads = (struct load *)malloc(sizeof(struct load) * (size_t)problem.holds);
    for (int i = 0; i < problem.holds; i++) {
        double held[2];
        numbers(file, "load", held, 2);
        problem.loads[i].uw = held[0];
        problem.loads[i].pull = held[1];
    }
    fclose(file);
    return problem;
}

static double cpu_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int main(int count, char **arguments)
{
    if (count == 2 && strcmp(arguments[1], "--version") == 0) {
        puts(version());
        return 0;
    }
    if (count != 6) give_up("usage", "peer PROBLEM METHOD SETTING RUNS OUT");
    const struct problem problem = problem_of(arguments[1]);
    const double setting = atof(arguments[3]);
    const size_t size = (size_t)problem.holds * STATES;
    double *out = (double *)calloc(size, sizeof(double));
    double best = 1e300;
    for (int i = atoi(arguments[4]); i > 0; i--) {
        const double began = cpu_s();
        if (run(&problem, arguments[2], setting, out) != 0) give_up("the run failed", arguments[2]);
        const double took = cpu_s() - began;
        if (took < best) best = took;
    }
    FILE *file = fopen(arguments[5], "wb");
    if (!file || fwrite(out, sizeof(double), size, file) != size || fclose(file) != 0)
        give_up("cannot write", arguments[5]);
    printf("%.9e\n", best);
    return 0;
}

#endif
