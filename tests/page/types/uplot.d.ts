// The declarations of the plots are published with them and are not kept here.
declare const uPlot: any;
export default uPlot;
