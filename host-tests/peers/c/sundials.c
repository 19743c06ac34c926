/* SUNDIALS: ARKODE's explicit methods of order 4, 5 and 8, CVODE's Adams and BDF. SETTING is the relative tolerance. */
#include <arkode/arkode_erkstep.h>
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_version.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include "peer.h"

static const char *version(void)
{
    static char text[32];
    SUNDIALSGetVersion(text, sizeof text);
    return text;
}

struct held {
    const struct plant *plant;
    const struct load *load;
};

static int function(realtype t, N_Vector x, N_Vector dx, void *held)
{
    const struct held *h = (const struct held *)held;
    (void)t;
    rates(h->plant, h->load, NV_DATA_S(x), NV_DATA_S(dx));
    return 0;
}

static int arkode(const struct problem *problem, int order, double tolerance, struct held *held, N_Vector x,
                  double *out, SUNContext context)
{
    double t = 0.0;
    void *memory = ERKStepCreate(function, t, x, context);
    int status = ERKStepSetUserData(memory, held);
    status |= ERKStepSStolerances(memory, tolerance, 1e-3 * tolerance);
    status |= ERKStepSetOrder(memory, order);
    for (int hold = 0; hold < problem->holds && status == 0; hold++) {
        const double end = (hold + 1) * problem->hold_s;
        double h = problem->hold_s;
        held->load = &problem->loads[hold];
        if (hold > 0) {
            /* the rates jump; the length of step that was good remains so */
            ERKStepGetCurrentStep(memory, &h);
            if (!(h > 0.0) || h > problem->hold_s) h = problem->hold_s;
            status |= ERKStepReset(memory, t, x);
        }
        status |= ERKStepSetInitStep(memory, h);
        status |= ERKStepSetStopTime(memory, end);
        while (status == 0 && t < end) {
            status = ERKStepEvolve(memory, end, x, &t, ARK_NORMAL);
            if (status == ARK_TSTOP_RETURN) status = 0;
        }
        memcpy(out + (size_t)hold * STATES, NV_DATA_S(x), sizeof(double) * STATES);
    }
    ERKStepFree(&memory);
    return status;
}

static int cvode(const struct problem *problem, int method, double tolerance, struct held *held, N_Vector x,
                 double *out, SUNContext context)
{
    double t = 0.0;
    SUNMatrix matrix = NULL;
    SUNLinearSolver linear = NULL;
    SUNNonlinearSolver nonlinear = NULL;
    void *memory = CVodeCreate(method, context);
    int status = CVodeInit(memory, function, t, x);
    status |= CVodeSetUserData(memory, held);
    status |= CVodeSStolerances(memory, tolerance, 1e-3 * tolerance);
    if (method == CV_BDF) {
        matrix = SUNDenseMatrix(STATES, STATES, context);
        linear = SUNLinSol_Dense(x, matrix, context);
        status |= CVodeSetLinearSolver(memory, linear, matrix);
    } else {
        nonlinear = SUNNonlinSol_FixedPoint(x, 0, context);
        status |= CVodeSetNonlinearSolver(memory, nonlinear);
    }
    for (int hold = 0; hold < problem->holds && status == 0; hold++) {
        const double end = (hold + 1) * problem->hold_s;
        held->load = &problem->loads[hold];
        if (hold > 0) status |= CVodeReInit(memory, t, x);
        status |= CVodeSetStopTime(memory, end);
        while (status == 0 && t < end) {
            status = CVode(memory, end, x, &t, CV_NORMAL);
            if (status == CV_TSTOP_RETURN) status = 0;
        }
        memcpy(out + (size_t)hold * STATES, NV_DATA_S(x), sizeof(double) * STATES);
    }
    CVodeFree(&memory);
    if (nonlinear) SUNNonlinSolFree(nonlinear);
    if (linear) SUNLinSolFree(linear);
    if (matrix) SUNMatDestroy(matrix);
    return status;
}

static int run(const struct problem *problem, const char *method, double setting, double *out)
{
    struct held held = {&problem->plant, &problem->loads[0]};
    SUNContext context;
    int order, status;
    if (SUNContext_Create(NULL, &context) != 0) return 1;
    N_Vector x = N_VNew_Serial(STATES, context);
    memcpy(NV_DATA_S(x), problem->start, sizeof(double) * STATES);
    if (sscanf(method, "erk%d", &order) == 1)
        status = arkode(problem, order, setting, &held, x, out, context);
    else if (strcmp(method, "adams") == 0)
        status = cvode(problem, CV_ADAMS, setting, &held, x, out, context);
    else
        status = strcmp(method, "bdf") == 0 ? cvode(problem, CV_BDF, setting, &held, x, out, context) : 1;
    N_VDestroy(x);
    SUNContext_Free(&context);
    return status;
}
